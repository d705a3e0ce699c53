"""Builds pendulum.fmu in the present folder, by the C compiler `cc`: python build.py"""

import pathlib
import subprocess
import zipfile

from fmpy import platform, sharedLibraryExtension

HERE = pathlib.Path(__file__).parent


def main() -> None:
    library = pathlib.Path(f"pendulum{sharedLibraryExtension}")
    subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-o", library, HERE / "pendulum.c", "-lm"], check=True)
    with zipfile.ZipFile("pendulum.fmu", "w") as archive:
        archive.write(HERE / "modelDescription.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{platform}/{library}")
    library.unlink()


if __name__ == "__main__":
    main()
