"""Is something odd? One check, one file in `checks`; `remarks.remarks_about` asks all that can be.

Whoever opens, imports, images, diagnoses or runs a rig says what is known of it (`Known`), and gets
the same remarks in the same words. A check looks at arrays and tables, and reads no file.
"""
