"""The command line: the words and options of `decode`, and how its failures end.

In come the words that a user typed.
Out go calls of the rooms below, text on the terminal, and an exit code.
"""
