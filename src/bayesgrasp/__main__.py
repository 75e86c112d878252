"""``python -m bayesgrasp`` is the command ``bayesgrasp``."""

from bayesgrasp.cli.main import main

if __name__ == "__main__":
    main()
