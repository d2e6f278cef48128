"""``python -m harpy_pin`` is the ``harpy`` command."""

from harpy_pin.cli.start import main

main()
