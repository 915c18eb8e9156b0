"""What results say: as lines of text, and as one page with pictures."""
