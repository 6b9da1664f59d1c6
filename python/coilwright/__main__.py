"""``python -m coilwright`` is the command ``coilwright``."""

import sys

from ._command import main

sys.exit(main())
