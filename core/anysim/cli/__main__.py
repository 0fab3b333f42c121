"""`python -m anysim.cli` is `anysim`."""

from anysim.cli.main import main

main()
