"""One thread for BLAS, also where NumPy was imported before this package could say so."""

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep BLAS to one thread; `@one_blas_thread()` does so while a function runs.

    Its other threads would wait for work at full speed: our systems are small or sparse.
    """
    with threadpool_limits(limits=1, user_api='blas'):
        yield
