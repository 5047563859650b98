"""What selection borrows: one file for each library, and no other file knows it."""
