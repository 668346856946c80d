"""The page in the words of the terminal: the addresses to open, each with the token."""

from pathlib import Path

from porotwin_cli.terminal import say
from porotwin_page.access import token_in
from porotwin_page.address import page_lines


def tell_page(page: str, token_file: Path | None) -> None:
    """Say where the page is: here, and from a phone if other machines reach it.

    Args:
        page: HOST:PORT of the page; empty: there is none.
        token_file: file with the token of confirmations, made if it is missing; None: there is no
            page.

    Raises:
        InputError: the file of the token cannot be made or read.
    """
    if page and token_file is not None:
        for line in page_lines(page, token_in(token_file)):
            say(line)
