"""`python -m innerattn`: the same as the command `innerattn`."""

import sys

from innerattn.cli.start import main

sys.exit(main())
