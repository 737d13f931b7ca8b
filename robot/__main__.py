"""`python -m robot` is `sweeper`."""

import sys

from robot.cli import main

sys.exit(main())
