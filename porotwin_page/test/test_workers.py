"""Tests of the threads of the page: requests that wait for a free one are seen."""

import asyncio
import threading

from porotwin_page.workers import Workers


def test_the_time_without_a_free_thread_is_known() -> None:
    now = [0.0]
    workers = Workers(2, clock=lambda: now[0])
    go_on, begun = threading.Event(), threading.Semaphore(0)

    def block(answer: int) -> int:
        begun.release()
        assert go_on.wait(60.0)
        return answer

    async def work() -> None:
        first = asyncio.create_task(workers.run(block, 1))
        await asyncio.to_thread(begun.acquire)
        now[0] = 5.0
        assert workers.busy_for == 0.0
        second = asyncio.create_task(workers.run(block, 2))
        third = asyncio.create_task(workers.run(block, 3))
        await asyncio.to_thread(begun.acquire)
        now[0] = 12.0
        assert workers.busy_for == 7.0
        go_on.set()
        assert await asyncio.gather(first, second, third) == [1, 2, 3]
        assert workers.busy_for == 0.0

    asyncio.run(work())
