"""The results of a call: outcomes, `results.json`, shards, comparison and artifacts."""
