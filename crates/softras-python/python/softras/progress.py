"""The progress of a fit while it runs."""

from __future__ import annotations

import contextlib
from typing import Callable, Iterator, Optional, Union

from .errors import InputError

Call = Callable[[int, float], None]
#: Called with the number of steps and the loss after each step; True for a bar.
Progress = Union[Call, bool, None]


@contextlib.contextmanager
def shown(progress: Progress, steps: Optional[int]) -> Iterator[Optional[Call]]:
    """The call that a fit makes after each step; for True it moves a bar of tqdm."""
    if progress is not True:
        yield progress or None
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        raise InputError("progress=True needs tqdm: pip install tqdm, or give a function") from None
    with tqdm(total=steps, unit="step") as bar:

        def move(step: int, loss: float) -> None:
            if step:
                bar.set_postfix(loss=f"{loss:.4g}", refresh=False)
            bar.update(step - bar.n)

        move.note = bar.write  # type: ignore[attr-defined]
        yield move
