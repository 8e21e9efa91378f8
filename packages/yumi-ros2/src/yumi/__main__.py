"""``python -m yumi``."""

from yumi.cli.main import main

if __name__ == "__main__":
    main()
