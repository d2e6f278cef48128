"""Runs the command line."""

from reproduction.cli.app import main

if __name__ == "__main__":
    main()
