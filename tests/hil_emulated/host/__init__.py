"""Host of the emulated computer: kernel, first file system, qemu, and the devices."""
