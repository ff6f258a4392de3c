"""Batches that are read by several processes at once: taken back in the order in which they were begun."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from decoder.frame_batch import Batch, Outcome, RawFrame


@dataclass(slots=True)
class Job:
    """Frames that one worker reads at a go: those of the batch `index` from `first` on."""

    index: int
    first: int
    frames: tuple[RawFrame, ...]
    deaths: int = 0
    """Workers that ended over it."""

    def one_by_one(self) -> list[Job]:
        """A job for each of its frames."""
        return self.in_parts(len(self.frames))

    def in_parts(self, count: int) -> list[Job]:
        """So many jobs in its place, each of about as many of its frames; none without frames."""
        cuts = [len(self.frames) * part // count for part in range(count + 1)]
        return [
            Job(self.index, self.first + start, self.frames[start:stop])
            for start, stop in pairwise(cuts)
            if start < stop
        ]


class BatchRow:
    """The batches that are not yet given back, in order, each with what is known of its frames so far."""

    def __init__(self) -> None:
        self._begun = 0
        self._given = 0
        self._open: dict[int, tuple[Batch, dict[int, Outcome]]] = {}

    def __len__(self) -> int:
        return len(self._open)

    def begin(self, batch: Batch) -> Job:
        """A new batch at the end of the row; gives the job of reading it."""
        self._open[self._begun] = (batch, {})
        self._begun += 1
        return Job(self._begun - 1, 0, batch)

    def fill(self, job: Job, outcomes: list[Outcome]) -> None:
        """What was read of a job's frames."""
        self._open[job.index][1].update(enumerate(outcomes, job.first))

    def finished(self) -> Iterator[tuple[Batch, list[Outcome]]]:
        """Takes from the row what is complete, as far as nothing before it is missing."""
        while self._given in self._open and len(self._open[self._given][1]) == len(self._open[self._given][0]):
            batch, outcomes = self._open.pop(self._given)
            self._given += 1
            yield batch, [outcomes[index] for index in range(len(batch))]
