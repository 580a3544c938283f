"""Collection: a tree of processes to a base over which messages go hop by hop, and answers back (``piece``)."""
