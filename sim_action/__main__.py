"""`python -m sim_action`."""

from sim_action.cli.main import main

if __name__ == "__main__":
    main()
