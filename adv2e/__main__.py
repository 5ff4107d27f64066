"""``python -m adv2e`` is the same as the command ``adv2e``."""

from adv2e.cli import main

if __name__ == "__main__":
    main()
