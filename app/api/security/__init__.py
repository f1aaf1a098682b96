"""Who may ask what: token, session, headers, rates, origins."""
