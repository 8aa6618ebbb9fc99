"""What the machine needs: cores, compiled programs, batches of fixed shape, files written whole."""
