"""`python -m mission_control` is `lalliance`."""

from mission_control.cli import main

if __name__ == "__main__":
    main()
