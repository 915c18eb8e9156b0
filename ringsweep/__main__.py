"""``python -m ringsweep``."""

from ringsweep.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
