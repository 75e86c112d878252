"""The hand and the arm: descriptions, their physics models, motions, and what the open hand touches."""
