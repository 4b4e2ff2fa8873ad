"""The causes of outcomes that lie in nodes: ends, logged errors, topics without a partner, and lost lock-step."""
