"""Work on Warp's device; on a GPU it is recorded once, as a CUDA graph."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import torch


class Recorded:
    """Calls `work` on Warp's device; on a GPU launches the graph that it was recorded as, on torch's stream.

    It holds what `work` holds, and nothing holds it but its owner: dropping it frees graph and arrays at once.

    Args:
        warp: the library.
        place: Warp's device.
        device: the same as torch calls it.
        work: launches kernels, always the same ones on the same arrays.
    """

    def __init__(self, warp: Any, place: Any, device: torch.device, work: Callable[[], None]):
        self._warp, self._place, self._device, self._work = warp, place, device, work
        self._graph: Any = None
        self._torch_stream: Any = None
        if device.type == "cuda":
            self._record()

    def __call__(self) -> None:
        if self._graph is None:
            with self._warp.ScopedDevice(self._place):
                self._work()
        else:
            self._warp.capture_launch(self._graph, stream=self._stream())

    def _record(self) -> None:
        self()  # compiles the kernels: nothing may be loaded while recording
        gc.collect()  # nor freed: arrays of simulations that are gone and still wait for the collector
        self._warp.synchronize_device(self._place)
        with self._warp.ScopedCapture(self._place) as capture:
            self()
        self._graph = capture.graph

    def _stream(self) -> Any:
        """The CUDA stream that torch uses now, so that its reads and writes and ours keep their order."""
        current = torch.cuda.current_stream(self._device)
        if self._torch_stream is None or self._torch_stream.cuda_stream != current.cuda_stream:
            self._torch_stream = self._warp.stream_from_torch(current)
        return self._torch_stream
