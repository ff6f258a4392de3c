"""The Sony DSC-QX10 over its Wi-Fi: finding it, setting it, taking stills or following its liveview.

In come the options of one camera, and whatever the network says, which is not trusted.
Out go frames, and reports of what the camera did and of each picture that is lost.
"""
