"""Builds pendulum.fmu in the present folder, by the C compiler `cc`: python build.py [WALL=0.5] [INTERNAL=0.1]"""

import pathlib
import subprocess
import sys
import zipfile

from fmpy import platform, sharedLibraryExtension

HERE = pathlib.Path(__file__).parent


def main(*variants: str) -> None:
    library = pathlib.Path(f"pendulum{sharedLibraryExtension}")
    defined = [f"-D{variant}" for variant in variants]
    subprocess.run(["cc", "-shared", "-fPIC", "-O2", *defined, "-o", library, HERE / "pendulum.c", "-lm"], check=True)
    description = (HERE / "modelDescription.xml").read_text()
    if any(variant.startswith("WALL") for variant in variants):
        description = description.replace('numberOfEventIndicators="0"', 'numberOfEventIndicators="1"')
    with zipfile.ZipFile("pendulum.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description)
        archive.write(library, f"binaries/{platform}/{library}")
    library.unlink()


if __name__ == "__main__":
    main(*sys.argv[1:])
