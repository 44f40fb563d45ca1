"""What is shown: figures, tables and the report, drawn from Datasets and tables only."""
