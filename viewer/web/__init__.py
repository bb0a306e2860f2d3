"""The viewer in a browser: the scene as pictures, sliders and lists as a page, both served by trame from here.

`resfit view --web` prints an address; `show` puts the same page below a cell of a notebook. Needs the extra `web`.
"""

from .notebook import Shown, show

__all__ = ["Shown", "show"]
