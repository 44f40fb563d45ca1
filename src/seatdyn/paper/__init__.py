"""The reproduction of the paper: its cases, its tables and figures beside ours, its misprints."""
