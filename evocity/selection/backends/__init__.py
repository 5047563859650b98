"""Libraries that selection uses, one file each; no other file imports them."""
