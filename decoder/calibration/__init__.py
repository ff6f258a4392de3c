"""What a camera's lens does, measured on photographs of rulers and boards whose size is known.

In come photographs and marks on them.
Out goes `camera.yaml`, with what each figure is uncertain by.
"""
