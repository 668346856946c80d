"""Is something odd? One check, one file in `checks`; `all_checks.remarks_about` asks them.

Commands and nodes give their data (`Known`), and all get the same remarks in the same words. A
check looks at arrays and tables, and reads no file.
"""
