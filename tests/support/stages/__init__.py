"""Stages on emulated controllers: over real wires (`emulated_stages`) and in memory."""
