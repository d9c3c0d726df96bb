"""The command line: ``friction-fmus`` or ``python -m friction_fmus``."""

import sys

if __name__ == "__main__" and not sys.flags.safe_path:
    sys.path.append(sys.path.pop(0))  # the working folder, which may have a file harness.py; workers get this path

from friction_fmus.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
