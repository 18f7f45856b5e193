"""The entry point of ``python -m radarsim``."""

from radarsim.cli import main

if __name__ == "__main__":
    main()
