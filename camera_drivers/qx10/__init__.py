"""The Sony DSC-QX10 over its Wi-Fi: found, set, and made to take pictures."""
