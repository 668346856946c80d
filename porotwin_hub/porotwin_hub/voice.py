"""Speech through espeak-ng."""

import queue
import shutil
import subprocess
import threading


class Voice:
    """Speaks one sentence after the other without blocking; silent without espeak-ng."""

    def __init__(self) -> None:
        """Look for espeak-ng; `program` is its path, or None."""
        self.program = shutil.which('espeak-ng')
        self._sentences: queue.Queue[str] = queue.Queue()
        if self.program is not None:
            threading.Thread(target=self._speak, args=(self.program,), daemon=True).start()

    def say(self, sentence: str) -> None:
        """Speak a sentence next; sentences that still wait are out of date and dropped."""
        if self.program is None:
            return
        while not self._sentences.empty():
            self._sentences.get_nowait()
        self._sentences.put(sentence)

    def _speak(self, program: str) -> None:
        while True:
            subprocess.run([program, self._sentences.get()], check=False, stderr=subprocess.DEVNULL)
