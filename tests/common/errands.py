"""Work for other processes; it stands by itself, so that a new Python has it at once."""

import os
import sys
import time
from pathlib import Path


def shout(path: str, words: str) -> None:
    os.write(1, words.encode())
    print(words, file=sys.stderr, flush=True)
    Path(path).write_text(f"{os.getpid()} {words}")


def crash() -> None:
    os.abort()


def fail() -> None:
    raise ValueError("of no interest to anyone")


def sleep() -> None:
    time.sleep(60)
