"""Files such as strangers send: whole in their structure, hostile in what they say, held against the programs."""
