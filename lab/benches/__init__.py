"""Speed and accuracy of single parts: a module is a part of `./porotwin bench`."""
