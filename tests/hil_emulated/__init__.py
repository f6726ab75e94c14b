"""Emulated computer: the project's tests for a bench under a real Linux kernel, without a bench.

qemu boots an installed kernel; its file system is this machine's. The devices are emulated on the
host (`host.bench`): serial adapters by qemu, camera and serial ports by USB/IP. In the guest the
kernel's own drivers (uvcvideo, vivid, ftdi_sio, cdc_acm) and udev stand between them and one pytest
process, which runs the contract tests of `tests.drivers` and those of `guest`. Start with
`__main__`; `link` carries the guest's requests to the bench, such as to pull a plug.
"""
