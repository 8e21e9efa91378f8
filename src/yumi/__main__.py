"""``python -m yumi``."""

from yumi.cli import main

if __name__ == "__main__":
    main()
