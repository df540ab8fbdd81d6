"""Writes all parts that are made, each in its page."""

from made.pages import renew

if __name__ == "__main__":
    renew()
