"""Communication lines that several devices may share: bytes, deadlines and lost answers.

Start with `serial_line` for controllers with text commands, with `modbus_bus` for Modbus devices.
"""
