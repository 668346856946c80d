"""The log of a node: one line per message, without characters that act on a terminal."""

from collections import defaultdict
from typing import Any

from rclpy.impl import rcutils_logger

from porotwin_core.basis.plain_text import plain

# rclpy takes the place of a message from its caller; this file is none, like those of rclpy
rcutils_logger._internal_callers.append(__file__)


class PlainLogger(rcutils_logger.RcutilsLogger):
    """A logger whose messages hold no control characters, whoever chose their words."""

    def __init__(self, name: str) -> None:
        """Make the logger of this name."""
        super().__init__(name)
        self._of_severity = defaultdict[Any, Any](lambda: rcutils_logger.RcutilsLogger(name))

    def log(self, message: Any, severity: Any, **kwargs: Any) -> bool:
        """Log a message, as rclpy does; one place in the code may log with any severity."""
        # rclpy raises ValueError at a second severity of a place
        return bool(self._of_severity[severity].log(plain(str(message)), severity, **kwargs))
