"""`python -m seatdyn`."""

from seatdyn.app.cli import main

if __name__ == "__main__":
    main()
