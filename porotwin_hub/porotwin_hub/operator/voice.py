"""Speech through espeak-ng."""

import shutil
import subprocess
import threading
from collections.abc import Callable, Iterable, Sequence

LONGEST_SENTENCE_S = 60.0
"""Longest time for one announcement [s]; a sound card that blocks for longer is broken."""


class Voice:
    """Speaks one announcement after the other without blocking; silent without espeak-ng."""

    def __init__(
        self,
        *,
        options: Sequence[str] = (),
        on_problem: Callable[[str], object] = str,
    ) -> None:
        """Look for espeak-ng; `program` is its path, or None.

        Args:
            options: further options of espeak-ng, such as `-w FILE` for a sound file.
            on_problem: receives one line when an announcement was not spoken.
        """
        self.program = shutil.which('espeak-ng')
        self._options = tuple(options)
        self._on_problem = on_problem
        self._waiting: list[tuple[str, frozenset[str]]] = []
        """Sentences, each with the wells that it is about."""
        self._came = threading.Condition()
        if self.program is not None:
            threading.Thread(target=self._work, args=(self.program,), daemon=True).start()

    def say(self, sentence: str, about: Iterable[str] = ()) -> None:
        """Speak a sentence after those that wait and tell of other things.

        Args:
            sentence: the text.
            about: the wells, or other things, that it tells of. A sentence that still waits and
                tells of no others is out of date and dropped.
        """
        if self.program is None:
            return
        told = frozenset(about)
        with self._came:
            self._waiting = [one for one in self._waiting if not one[1] <= told]
            self._waiting.append((sentence, told))
            self._came.notify()

    def _work(self, program: str) -> None:
        while True:
            with self._came:
                self._came.wait_for(lambda: self._waiting)
                sentence, _ = self._waiting.pop(0)
            self._speak(program, sentence)

    def _speak(self, program: str, sentence: str) -> None:
        try:
            ended = subprocess.run(
                [program, *self._options, '--stdin'],
                input=sentence.encode(),
                check=False,
                capture_output=True,
                timeout=LONGEST_SENTENCE_S,
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            self._on_problem(f'nothing was spoken: {error}')
            return
        if ended.returncode != 0:
            said = ended.stderr.decode(errors='replace').strip().splitlines()
            last = said[-1] if said else f'status {ended.returncode}'
            self._on_problem(f'nothing was spoken: espeak-ng says {last}; check the sound card')
