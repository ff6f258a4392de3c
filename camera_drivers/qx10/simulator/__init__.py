"""A QX10 that is none: the three services of the camera on loopback, and every way to misbehave.

    ledger ◀── http_services ──▶ model ──▶ pictures
                    │              │
                 faults ───────────┘          search_answers (SSDP)

It follows docs/qx10.md, is as strict as the camera is known to be, and imports nothing of the driver but the numbers of
errors, so that both do not share one misunderstanding.
"""
