"""The exceptions of softras. Each has the library's text: what is wrong, where, and how to fix it."""


class Error(Exception):
    """The base of all exceptions of softras."""


class InputError(Error, ValueError):
    """An argument has the wrong shape, type or name."""


class MeshError(Error, ValueError):
    """A mesh's data is inconsistent or not finite."""


class CameraError(Error, ValueError):
    """A camera cannot be made from these numbers."""


class LightError(Error, ValueError):
    """A light's field is out of range."""


class SettingsError(Error, ValueError):
    """A setting is out of range."""


class SceneError(Error, ValueError):
    """The numbers of meshes and cameras do not match."""


class IoError(Error, OSError):
    """A file cannot be read or written."""


class FileError(Error, ValueError):
    """A file's content is malformed."""


class NoDeviceError(Error, RuntimeError):
    """There is no Vulkan loader, no driver, or no device with what the kernels need."""


class LimitError(Error, RuntimeError):
    """The frame needs more than a limit of the device allows."""


class OutOfMemoryError(Error, MemoryError):
    """An allocation of host or device memory failed."""


class NotFiniteError(Error, ArithmeticError):
    """The device computed an infinite value or a NaN although all inputs were finite."""


class BackwardError(Error, RuntimeError):
    """A frame cannot be differentiated as asked."""


class FitError(Error, ValueError):
    """The inputs of a fit are inconsistent or out of range."""


class DeviceLostError(Error, RuntimeError):
    """The driver reset the device: open a new renderer."""


class VulkanError(Error, RuntimeError):
    """A Vulkan call failed."""


class ForkError(Error, RuntimeError):
    """A renderer was used in a process that was forked after it was opened."""
