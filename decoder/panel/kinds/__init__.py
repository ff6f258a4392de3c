"""How each kind of instrument is described: a module for each, with its keys and what is drawn of it.

In come the keys of one gauge in `panel.yaml`.
Out go its quantities, and what people see and draw of it.
"""
