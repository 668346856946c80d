"""The log of a node: one line per message, without characters that act on a terminal."""

from typing import Any

from rclpy.impl import rcutils_logger

from porotwin_core.basis.plain_text import plain

# rclpy takes the place of a message from its caller; this file is none, like those of rclpy
rcutils_logger._internal_callers.append(__file__)


class PlainLogger(rcutils_logger.RcutilsLogger):
    """A logger whose messages hold no control characters, whoever chose their words."""

    def log(self, message: Any, severity: Any, **kwargs: Any) -> bool:
        """Log a message, as rclpy does."""
        return bool(super().log(plain(str(message)), severity, **kwargs))
