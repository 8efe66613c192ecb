"""Play and measure: episodes, games, leagues, speed."""
