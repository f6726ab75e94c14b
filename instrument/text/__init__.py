"""Text and files at the border of the program: durable files, quoted values, safe terminals.

Open `atomic_file` first: everything that the program writes, except the record, goes through it.
"""
