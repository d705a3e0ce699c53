"""Builds pendulum.fmu in the present folder, by the C compiler `cc`: python build.py [FMI2|FMI3] [WALL=0.5] [INTERNAL=0.1]"""

import pathlib
import subprocess
import sys
import zipfile

from fmpy import platform, platform_tuple, sharedLibraryExtension

HERE = pathlib.Path(__file__).parent


def main(*variants: str) -> None:
    library = pathlib.Path(f"pendulum{sharedLibraryExtension}")
    defined = [f"-D{variant}" for variant in variants if not variant.startswith("FMI")]
    source, text, folder = ("pendulum.c", "modelDescription.xml", platform)
    if "FMI3" in variants:
        source, text, folder = ("fmi3.c", "modelDescription3.xml", platform_tuple)
    subprocess.run(["cc", "-shared", "-fPIC", "-O2", *defined, "-o", library, HERE / source, "-lm"], check=True)
    description = (HERE / text).read_text()
    if any(variant.startswith("WALL") for variant in variants):
        description = description.replace('numberOfEventIndicators="0"', 'numberOfEventIndicators="1"')
    else:
        description = description.replace('<EventIndicator valueReference="9"/>\n', "")
    with zipfile.ZipFile("pendulum.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{folder}/{library}")
    library.unlink()


if __name__ == "__main__":
    main(*sys.argv[1:])
