"""A simulated QX10: the camera's three services on loopback, as strict as the camera is known to be, with every fault.

In come calls and searches over the network, and orders to misbehave; of the driver it knows only the error numbers.
Out go answers, pictures and liveview as docs/qx10.md has them, and a ledger of what was taken and delivered.
"""
