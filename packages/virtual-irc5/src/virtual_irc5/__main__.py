"""``python -m virtual_irc5``."""

from virtual_irc5.commands.main import main

if __name__ == "__main__":
    main(prog_name="virtual-irc5")
