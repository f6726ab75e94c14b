"""Emulated USB devices that real kernel drivers bind to: exported by USB/IP, imported by vhci_hcd.

The devices run in the process of the emulated bench; a guest computer imports them over TCP. Open
`device` first (a USB device and its requests), then `uvc_camera` and `acm_port` (the two devices),
`server` and `link` (export and transfers), `usbip` (messages) and `vhci` (the guest's side).
"""
