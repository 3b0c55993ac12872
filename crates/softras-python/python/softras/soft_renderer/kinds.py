"""The types of arguments, as the official package takes them."""

import os
from typing import Sequence, Tuple, Union

import numpy as np
import torch

Array = Union[torch.Tensor, np.ndarray]
Number = Union[float, torch.Tensor]
Path = Union[str, "os.PathLike[str]"]
Size = Union[int, Tuple[int, int]]
#: One vector, or one for each mesh of a batch.
Vector = Union[Sequence[float], torch.Tensor, np.ndarray]
