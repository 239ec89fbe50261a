"""``python -m innerattn.train.workers``: a worker, started by `innerattn.train.workers.start`."""

import sys

from innerattn.train.workers.worker import main

sys.exit(main())
