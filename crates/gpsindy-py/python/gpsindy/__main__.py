"""The command ``gpsindy``, also as ``python -m gpsindy``: the one command line of the project."""

from __future__ import annotations

import pathlib
import signal
import sys

from gpsindy import _gpsindy


def main() -> None:
    """Runs the command line of this process and exits with its status."""
    # The work is not Python's: Ctrl-C ends the process at once, as it ends the program that Cargo installs.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_gpsindy.command([str(_program()), *sys.argv[1:]]))


def _program() -> pathlib.Path:
    """The script that was started, or the one in the interpreter's folder: ``gpsindy mcp`` finds its server there."""
    script = pathlib.Path(sys.argv[0])
    return script if script.stem == "gpsindy" else pathlib.Path(sys.executable).with_name("gpsindy")


if __name__ == "__main__":
    main()
