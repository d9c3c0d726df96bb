"""The command line: ``friction-fmus`` or ``python -m friction_fmus``."""

import sys

from friction_fmus.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
